"""Ada: a human head with the 52 ARKit blendshapes."""

from __future__ import annotations

import numpy as np

from . import ada_form as form
from . import ada_parts as parts
from .ada_head import Head, build_head
from .ada_jaw import jaw_follow, joint_weights
from .ada_poses import face_targets
from .mesh import Character, IntArray, Joint, JointAnimation, Material, Mesh, Part, finish
from .mouth import CONTACT, lip_landmarks

SKIN = Material("Skin", (0.78, 0.47, 0.345), 0.55)
LIPS = Material("Lips", (0.56, 0.205, 0.185), 0.42)
LINING = Material("Lining", (0.165, 0.030, 0.030), 0.60)
LASH = Material("Lash", (0.030, 0.015, 0.012), 0.60)
JOINTS = (
    ("root", -1, (0.0, -0.2400, -0.030)),
    ("neck", 0, (0.0, -0.1650, -0.034)),
    ("head", 1, (0.0, -0.0850, -0.018)),
    ("jaw", 2, (0.0, float(form.JAW_AXIS[1]), float(form.JAW_AXIS[2]))),
)


def build_ada() -> Character:
    """Sculpt the whole character."""
    head = build_head()
    follow = jaw_follow(head)
    count = len(head.points)
    ear_points, ear_triangles = parts.ears()
    lashes, lower = _lashes(head)
    skin = np.concatenate([head.shell.triangles("skin"), lower, ear_triangles + count])
    groups = [
        Part(SKIN, skin),
        Part(LIPS, head.shell.triangles("lips")),
        Part(LINING, head.shell.triangles("lining")),
        Part(LASH, lashes),
    ]
    still = np.zeros((len(ear_points), 3))
    targets = {
        name: np.concatenate([delta, still]) for name, delta in face_targets(head, follow).items()
    }
    weights = np.concatenate([joint_weights(head.points, follow), parts.rigid(len(ear_points), 2)])
    landmarks = lip_landmarks(head.mouth)
    front = np.where(np.abs(head.points[:, 0]) < 1e-6, head.points[:, 1] + 0.1, 1.0)
    front[head.points[:, 2] < 0.07] = 1.0
    landmarks["chin"] = [int(np.argmin(np.abs(front)))]
    points = np.concatenate([head.points, ear_points])
    face = Mesh("Face", points, groups, weights, targets, landmarks)
    lips_z = float(head.points[head.mouth[CONTACT, head.mouth.shape[1] // 4], 2])
    meshes = [face, parts.eyes(), parts.teeth(lips_z), parts.tongue_mesh(lips_z), parts.brows(),
              parts.hair(), parts.collar()]  # fmt: skip
    joints = [Joint(name, parent, position) for name, parent, position in JOINTS]
    return finish(Character("Ada", meshes, joints, [idle()]), (0.0, form.FEET_TO_EYES, 0.0))


def _lashes(head: Head) -> tuple[IntArray, IntArray]:
    """Triangles of the edges of the upper lids, and of the lower ones, which have no lashes."""
    below = np.zeros(len(head.points), dtype=bool)
    for rings in head.lids:
        m = rings.shape[1]
        below[rings[:, m // 2 :]] = True
        below[rings[:, 0]] = True
    edge = head.shell.triangles("lash")
    lower = below[edge].all(1)
    return edge[~lower], edge[lower]


def idle() -> JointAnimation:
    """Two seconds of a gentle sway of neck and head, looping."""
    times = np.arange(0, 49, 4) / 24.0
    turn = np.pi * times
    rotations = {}
    for name, yaw, tilt, delay in (("neck", 1.6, 1.0, 0.0), ("head", 2.4, 1.5, 0.5)):
        y = np.radians(yaw) * np.sin(turn - delay)
        z = np.radians(tilt) * np.sin(turn - delay + 0.9)
        x = np.radians(0.8) * np.sin(2 * turn - delay)
        q = 0.5 * np.stack([x, y, z], axis=1)
        q = np.concatenate([q, np.ones((len(q), 1))], axis=1)
        rotations[name] = np.round(q / np.linalg.norm(q, axis=1, keepdims=True), 7)
    return JointAnimation("idle", times, rotations)
