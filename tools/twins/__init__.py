"""`ranger-sim twins`: emulated walks of sound robots and of robots with one cause each, and the file made of them."""
