"""The published method in the paper's order: model, features, registration, tracker.

A. Brost, R. Liao, J. Hornegger, N. Strobel: "3-D Respiratory Motion Compensation during EP Procedures by Image-Based
3-D Lasso Catheter Model Generation and Tracking", MICCAI 2009. What still differs from the paper: docs/brost2009.md.
"""
