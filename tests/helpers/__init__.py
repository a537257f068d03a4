"""What several test files share: clips, scenes, networks, servers."""
