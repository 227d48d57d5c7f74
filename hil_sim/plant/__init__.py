"""The robot and what is on its end-effector: equations of motion in C, geometry and references in numpy."""
