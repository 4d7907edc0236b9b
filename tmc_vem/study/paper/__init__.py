"""The paper's results (Xu & Wriggers, CMAME 450 (2026) 118611) and the runs that reproduce them."""
