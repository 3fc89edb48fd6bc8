"""Rules about the lidar and the camera."""
