"""Parts of mistakes_validation.py."""
