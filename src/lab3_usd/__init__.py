"""Author and check the USD stages of the TurtleBot 3 lab, without Isaac Sim and without a GPU."""
