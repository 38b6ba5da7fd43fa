"""DICOM X-ray angiography (XA, Enhanced XA): frames, their times, and the geometry of each."""
