"""What happens when a service fails: the avatar apologises, the turn ends, the next one works."""
