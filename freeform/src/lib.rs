//! Free forms: quadrics with cubic perturbations and their unions, ray traced exactly
