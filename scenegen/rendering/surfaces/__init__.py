"""Where rays meet exact surfaces of basic shapes: in the kernel, and in numpy for comparison."""
