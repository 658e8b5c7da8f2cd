"""`forge test-result`: summarizes and deletes the result files of tests."""
