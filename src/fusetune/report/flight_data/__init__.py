"""What the interactive views of a flight show: gathered from what the rooms wrote, thinned, packed into one blob."""
