"""Workers: human proportions, a walk whose feet do not slide, workwear and what people carry."""
