"""What a bundle tells of the avatar besides its looks."""
