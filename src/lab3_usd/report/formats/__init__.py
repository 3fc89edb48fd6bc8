"""The output formats of `lab3 check`: one module each."""
