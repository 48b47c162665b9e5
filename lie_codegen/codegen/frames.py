"""What a frame of generated C takes beside its values."""

#: Bytes of a frame beside its values: registers saved, arguments passed on the stack, alignment. Bytes of libm below a kernel.
FRAME, LIBRARY = 320, 2048
