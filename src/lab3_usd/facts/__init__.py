"""What a stage says and does on a platform: values, wires, topics, frames, joints; no lab."""
