"""What an image does not show: surfaces of other views, and solids along rays.

`behind` scores other views, with the baselines of `guesses`; `solids` scores layers.
"""
