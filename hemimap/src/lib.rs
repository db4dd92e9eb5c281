//! Area-preserving maps between the square, the disk and the hemisphere, and frames for normals
