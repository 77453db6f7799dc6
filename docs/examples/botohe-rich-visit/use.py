from botohe_rich_visit import RichVisit

from botohe_moo import solve
from botohe_moo.operators import MixedMutation, RuinRecreate

mutation = MixedMutation({RuinRecreate(): 2, RichVisit(): 1}, prob=0.7)
print(solve("art_museum", "nsga2", mutation=mutation, evaluations=2_000))
