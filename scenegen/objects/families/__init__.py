"""Built-in families of everyday objects, made by the program instead of read from files.

Each file builds one family (`vessels` two: bowls and mugs) from random proportions and styles.
`home` has those that furnish closed rooms. `parts` holds the geometry that several families share.
Start with `members.member_shape`, which turns a family and a number into a unit shape; `store`
keeps members for later.

The order of the random draws is part of the data format: swapping two draws changes every member.
"""
