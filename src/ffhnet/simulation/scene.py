"""The MuJoCo scene of a grasp trial: a floating hand, one object, and a table that can drop away.

The palm stands still and the table sinks by the lift height, which is the same motion seen from the hand
and needs no moving base: a mocap body has no velocity, so a lifted mocap hand would leave the object behind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ffhnet.hands import Hand
from ffhnet.objects.grasp_object import GraspObject
from ffhnet.simulation.physics import Physics


@dataclass(frozen=True)
class Scene:
    """A compiled model with the indices that a trial needs.

    Attributes:
        model, data: MuJoCo's; `data` is scratch space that every trial resets.
        joint_qpos: qpos index of each actuated joint, in the hand's order.
        finger_qpos, finger_angle: of each joint, coupled ones included, its qpos index and the actuated joint
            whose angle it has.
        actuators: ctrl index of each actuated joint, in the hand's order.
        object_qpos: qpos index of the object's free joint.
        geom_owner: for each geom TABLE, OBJECT, HAND or ARM.
        hand_mocap, table_mocap: mocap indices.
        object_body: body id of the object.
        nominal_mass, nominal_inertia: of the object as it was built, kg and kg m².

    The object's indices are -1 in a scene without one, the hand's mocap index is -1 where an arm carries it.
    """

    hand: Hand
    physics: Physics
    model: mujoco.MjModel
    data: mujoco.MjData
    joint_qpos: Int[np.ndarray, " J"]
    finger_qpos: Int[np.ndarray, " F"]
    finger_angle: Int[np.ndarray, " F"]
    actuators: Int[np.ndarray, " J"]
    object_qpos: int
    geom_owner: Int[np.ndarray, " G"]
    hand_mocap: int
    table_mocap: int
    object_body: int
    nominal_mass: float
    nominal_inertia: Float[np.ndarray, " 3"]

    def place_hand(self, T_world_root: Float[np.ndarray, "4 4"], joints: Float[np.ndarray, " J"]) -> None:
        """Sets the hand's root pose and joint angles (rad), coupled joints included."""
        self.data.mocap_pos[self.hand_mocap] = T_world_root[:3, 3]
        mujoco.mju_mat2Quat(self.data.mocap_quat[self.hand_mocap], T_world_root[:3, :3].ravel())
        self.place_fingers(joints)

    def place_fingers(self, joints: Float[np.ndarray, " J"]) -> None:
        """Sets the hand's joint angles (rad), coupled joints included, and leaves it where it is."""
        self.data.qpos[self.finger_qpos] = joints[self.finger_angle]

    def place_object(self, T_world_object: Float[np.ndarray, "4 4"]) -> None:
        """Sets the object's pose."""
        q = self.object_qpos
        self.data.qpos[q : q + 3] = T_world_object[:3, 3]
        mujoco.mju_mat2Quat(self.data.qpos[q + 3 : q + 7], T_world_object[:3, :3].ravel())

    def raise_hand(self, height: float) -> None:
        """Moves the hand to a height (m) over where it closed, seen from the table."""
        self.data.mocap_pos[self.table_mocap, 2] = -height

    def vary(self, mass: float = 1.0, friction: float | None = None) -> None:
        """Changes what the world is like from now on; without arguments it is nominal again.

        Args:
            mass: factor on the object's mass and inertia.
            friction: sliding coefficient of every contact, the nominal one if none.
        """
        model, body = self.model, self.object_body
        model.body_mass[body] = mass * self.nominal_mass
        model.body_inertia[body] = mass * self.nominal_inertia
        model.geom_friction[:, 0] = self.physics.friction[0] if friction is None else friction
        # What the solver derives from mass; it leaves the scratch state behind at the reference pose.
        mujoco.mj_setConst(model, self.data)

    @property
    def table_z(self) -> float:
        """World z of the table top, m."""
        return float(self.data.mocap_pos[self.table_mocap, 2])


TABLE, OBJECT, HAND, ARM = 0, 1, 2, 3
MOUNT = "hand"
"""Name of the body that the hand's root sits on."""
PREFIX = "hand/"
"""Before the names of the hand's joints and bodies in a scene."""


def floating_mount(spec: mujoco.MjSpec) -> mujoco.MjsBody:
    """Adds a body that stands where it is placed, for the hand to sit on."""
    return spec.worldbody.add_body(name=MOUNT, mocap=True)


def build_scene(
    hand: Hand,
    obj: GraspObject | None,
    physics: Physics | None = None,
    add_mount: Callable[[mujoco.MjSpec], mujoco.MjsBody] = floating_mount,
) -> Scene:
    """Compiles the scene of one hand and one object, or of the hand alone.

    Args:
        hand: the hand.
        obj: the object, or None.
        physics: constants.
        add_mount: adds what carries the hand and returns the body named `MOUNT` that the hand's root sits on.
    """
    physics = physics or Physics()
    spec = mujoco.MjSpec()
    _set_options(spec, physics)

    table = spec.worldbody.add_body(name="table", mocap=True)
    table.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1.0, 1.0, 0.1])

    hand_spec = hand.spec()
    mount = add_mount(spec)
    root = mount.add_frame().attach_body(hand_spec.worldbody.first_body(), PREFIX, "")
    if mount.mocap:
        # The palm stands as still as the table, and MuJoCo only looks at such pairs where they are named.
        # These contacts are found but push nothing, so that their friction does not matter.
        for geom in root.geoms:
            spec.add_pair(geomname1="table", geomname2=geom.name)
    # After the hand: a tenth faster, since the solver's matrices fill up less.
    if obj is not None:
        add_object(spec, obj)
    for geom in spec.geoms:
        geom.friction = physics.friction
        geom.solref = [physics.contact_time_constant, 1.0]
        geom.condim = 4
    for equality in spec.equalities:
        equality.solref = [physics.contact_time_constant, 1.0]
        equality.solimp[:3] = [0.95, 0.99, 0.001]
    model = spec.compile()
    return _index(hand, physics, model)


def add_object(spec: mujoco.MjSpec, obj: GraspObject, name: str = "object") -> None:
    """Adds an object as a free body of this name, at the world's origin until it is placed."""
    body = spec.worldbody.add_body(name=name)
    body.add_freejoint()
    density = obj.mass / sum(piece.volume for piece in obj.pieces)
    for i, piece in enumerate(obj.pieces):
        mesh = spec.add_mesh(name=f"{name}_{i}", uservert=np.asarray(piece.vertices, np.float32).ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        # The world's bit 1 in both masks: every part of the hand names it as something to collide with.
        body.add_geom(
            name=f"{name}_{i}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"{name}_{i}", density=density
        )


def _set_options(spec: mujoco.MjSpec, physics: Physics) -> None:
    option = spec.option
    option.timestep = physics.timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = physics.impratio
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations = 50
    option.ls_iterations = 50
    option.tolerance = 1e-8
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # One contact point for each pair of shapes: fingers are capsules, and the labels stay the same.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD


def _index(hand: Hand, physics: Physics, model: mujoco.MjModel) -> Scene:
    hand_body = model.body(MOUNT).id
    object_body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "object")
    joint_qpos = [model.joint(PREFIX + name).qposadr[0] for name in hand.joint_names]
    follower_qpos = [model.joint(PREFIX + c.follower).qposadr[0] for c in hand.tree.couplings]
    leader = [hand.joint_names.index(c.leader) for c in hand.tree.couplings]
    return Scene(
        hand=hand,
        physics=physics,
        model=model,
        data=mujoco.MjData(model),
        joint_qpos=np.array(joint_qpos),
        finger_qpos=np.array(joint_qpos + follower_qpos),
        finger_angle=np.array([*range(hand.num_joints), *leader]),
        actuators=np.array([model.actuator(PREFIX + name).id for name in hand.joint_names]),
        object_qpos=int(model.jnt_qposadr[model.body_jntadr[object_body]]) if object_body >= 0 else -1,
        geom_owner=_body_owners(model)[model.geom_bodyid],
        hand_mocap=int(model.body_mocapid[hand_body]),
        table_mocap=int(model.body_mocapid[model.body("table").id]),
        object_body=object_body,
        nominal_mass=float(model.body_mass[object_body]),
        nominal_inertia=model.body_inertia[object_body].copy(),
    )


def _body_owners(model: mujoco.MjModel) -> Int[np.ndarray, " B"]:
    """Every body belongs to what the nearest named ancestor is; what carries the hand is the arm."""
    named = {"table": TABLE, "object": OBJECT, MOUNT: HAND}
    owner = np.full(model.nbody, ARM)
    for body in range(1, model.nbody):
        owner[body] = named.get(model.body(body).name, owner[model.body_parentid[body]])
    return owner
