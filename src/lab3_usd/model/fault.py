"""The kinds of faults that a dry run, or a recording of the running system, can show."""

from __future__ import annotations

from typing import Literal, get_args

# fmt: off
FaultKind = Literal[
    # nodes and their graphs
    "graph-not-evaluated", "simulation-stopped", "unknown-type", "unknown-port", "refused-wire",
    "not-executed",
    "switched-off", "zero-gate-step", "invalid-conversion", "no-number-input", "no-vector-input",
    "wrong-array-type", "invalid-context", "invalid-qos-profile", "unmatched-peer",
    "invalid-topic-name",
    # commands and the drive
    "ramp-without-time-step", "invalid-wheel-size", "no-joint-controller", "no-articulation",
    "excluded-joint", "unknown-joint", "empty-joint-name", "wrong-command-count",
    "non-numeric-command", "several-commands", "no-position-drive", "no-chassis-body",
    "unequal-joint-arrays", "joint-off-target", "wrong-joint-state", "link-off-frame",
    "no-inertial-sensor",
    # the robot
    "no-driven-robot", "kinematic-link", "base-fixed-to-world", "no-gravity", "no-ground",
    "no-wheel-contact", "no-grip", "locked-joint", "no-velocity-drive", "weak-drive",
    "limited-joint", "tips-over",
    # motion
    "moves-uncommanded", "moves-sideways", "does-not-stop", "does-not-move", "wall-ahead",
    "wrong-distance", "wrong-turn", "wrong-arc", "sideways-drift", "turn-off-centre",
    "wrong-speed-limit",
    # odometry and time
    "wrong-odometry-frame", "wrong-odometry-pose", "wrong-odometry-velocity", "clock-jumps-back",
    "wrong-clock-rate", "stopped-clock", "wrong-stamp", "stamp-not-advancing",
    # topics
    "silent-topic", "wrong-topic", "namespaced-topic", "wrong-domain", "wrong-message-type",
    "duplicate-publisher", "extra-publisher", "wrong-durability", "unreadable-message",
    "single-message", "wrong-header-frame",
    # frames
    "no-target-prim", "no-frames-input", "unequal-frame-arrays", "missing-frame", "self-parent",
    "several-parents", "several-publishers", "changing-parent", "frame-cycle",
    "disconnected-frame", "unknown-frame", "transform-ends", "transform-gap",
    "transform-unlike-odometry",
    # sensors
    "no-camera-target", "missing-camera-prim", "empty-image", "no-render-product",
    "wrong-render-product", "unknown-output", "not-a-camera", "not-a-lidar", "no-lidar-schema",
    "invalid-scan-profile",
    "loose-sensor", "wrong-scan-rate", "wrong-turn-rate", "no-ray-returns", "scan-off-walls",
    "image-info-frames-differ", "image-info-sizes-differ", "image-info-rates-differ",
    "low-image-rate", "misplaced-camera-frame", "camera-not-ahead", "camera-not-upright",
    # localization and navigation
    "map-shifted", "map-inverted", "scan-off-map",
    "no-localization", "localization-ends", "no-goal-sent", "goal-not-reached",
]
# fmt: on

FAULT_KINDS: tuple[str, ...] = get_args(FaultKind)
