"""Train the network of the learned compensator on our own flights: ``python -m skyarm.learn FILE``.

Flights of random motions in random winds with random masses, payloads and joint friction are flown first with the
paper's law, then with the law and the network so far, so that the network also sees the states to which its own answers
lead (Ross, Gordon, Bagnell 2011). What it shall tell is the generalized force that the model leaves out: inverse
dynamics of the model at the flown acceleration, less what rotors and joints were told. All follows from the seed.
"""
