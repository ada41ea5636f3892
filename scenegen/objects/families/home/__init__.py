"""Families that furnish interiors: seats, storage, textiles, tableware, paper, devices, plants.

They are built in metres. Only the preset of closed rooms draws them unasked.
"""
