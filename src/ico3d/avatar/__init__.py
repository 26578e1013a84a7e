"""One person from parts: baking trained models into the bundle that is deployed."""
