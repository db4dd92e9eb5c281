//! The four-term integrator, photon maps, the reference path tracer, the film and measures of error
