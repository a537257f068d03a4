"""The web server of a live session: access, messages to clients, commands from clients."""
