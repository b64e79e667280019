"""What can be seen in an image: noise power, sharpness, and how well lesions are found, against dose."""
