"""The open body model: its files, shapes, joints, named points, and how joints can turn."""
