"""Pictures of moving cameras and deforming objects: transfer at points, by triple products or by zonal harmonics."""
