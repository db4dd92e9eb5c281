//! Records of incident radiance: textures, surface elements in depth layers, and the search for a record
