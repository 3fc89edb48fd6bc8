"""What a course or a student sets once for all commands, in a file beside the stages."""
