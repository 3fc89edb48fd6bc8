"""The names of the files that describe a lab."""

CATALOG = "node_types.yaml"
CHECKPOINTS = "checkpoints.yaml"
ROS = "ros.yaml"
RUBRIC = "rubric.yaml"
SCENE = "scene.yaml"
STARTER = "starter.yaml"
SUBMISSION = "submission.yaml"
