"""The natural conversation: neural services in packages that everyone can reach."""
