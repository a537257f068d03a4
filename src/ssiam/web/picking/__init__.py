"""Choosing targets in the browser before a clip is tracked (`ssiam track` without ``--box``).

`ssiam.web.picking.page.PickPage` is the whole of it, and needs the extra ``web``.
"""
