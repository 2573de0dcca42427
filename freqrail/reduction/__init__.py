"""From any system to small blocks that do not feel each other, and to the columns that |T|^2 is a sum of."""
