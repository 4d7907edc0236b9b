"""Many runs: batches, comparisons and the paper's figures."""
