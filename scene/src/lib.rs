//! Meshes, free forms, materials, lights and cameras, their acceleration structure and their files
