"""Bodies that another simulator computes, behind the interface of plant/plant.py: MuJoCo models and FMI units."""
