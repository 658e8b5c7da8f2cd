"""What packages read without declaring it, for `forge build --audit`."""
