"""The LPC2194 as a program in its flash sees it: registers at their addresses, and a board that runs an image."""
