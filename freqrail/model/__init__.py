"""The physics: laws of elements, systems of bodies, legs and wheels, and what is read off them."""
