"""an arm on a cart by its shoulder singularity: four ways to drive the cart

A UR10 on a cart passes its shoulder singularity (Salvato et al. 2022). The cart is driven linearly, by a redundancy
scheme, by the paper's gradient descent, and by the exact law, along one axis and in the plane. Prints which laws cross
the forbidden region or miss the taught joints, and draws the paper's figures 3 to 9. The last line on stdout is the
last file.
"""
