"""Objects to grasp: procedural families, scanned meshes, their pieces, weight and resting poses."""
