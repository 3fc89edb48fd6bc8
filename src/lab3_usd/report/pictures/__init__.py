"""Pictures of graphs and TF trees."""
