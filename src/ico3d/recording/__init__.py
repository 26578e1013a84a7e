"""The page on which somebody records themselves, and the making of their avatar: `ico3d studio`."""
