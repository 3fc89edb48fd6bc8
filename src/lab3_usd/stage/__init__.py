"""Reading and writing USD: the only package that imports pxr."""
