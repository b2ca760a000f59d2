"""Whether a vehicle can fly, and why not: one file per question, each answer a finding."""
