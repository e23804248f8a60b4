"""The viewer in the browser: what was seen, the hands that would grasp it, and how they close and lift."""
