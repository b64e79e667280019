"""What the rays say of an image that was made from them: residuals, scores of discs, repetitions."""
