"""How a recorded person moved: a skeleton fitted to what several cameras, or one, show."""
