"""What is measured: errors of signals and pictures against their truth, beside what trivial answers score.

Only pixels with a hit count. All numbers are Python floats; NaN where no pixel counts. A squared error is the product
of the differences from two independent halves of the truth, so that the truth's own noise adds no bias.
"""
