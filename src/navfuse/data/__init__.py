"""What flows through navfuse: logs, state layout, navigation state, trajectory, result."""
