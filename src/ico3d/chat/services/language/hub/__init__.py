"""Language models of the Hugging Face hub in this process, through transformers."""
