"""What an image looks like: gray-level co-occurrence and histograms, and how near they come to a reference."""
