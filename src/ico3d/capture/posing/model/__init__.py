"""The open body model: its files, shapes, joints, landmarks, and how far joints can turn."""
