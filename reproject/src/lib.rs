//! Reprojection of radiance records to new points with bit masks
