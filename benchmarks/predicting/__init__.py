"""How near predictors come to the optimum on assets they have not seen, and what each costs."""
