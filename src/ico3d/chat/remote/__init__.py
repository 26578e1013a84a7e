"""Recognition, language, voice and expression on another machine: servers, and their clients."""
