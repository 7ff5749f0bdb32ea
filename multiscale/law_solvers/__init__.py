"""Ways to find load steps from patch laws; none of them knows a scene.

embedded     laws on the contact face of finite elements
condensed    laws on the compliance of the patches, by a dense Newton's method; and consistent laws
             under a plane without moment, along the path of their rows
"""
