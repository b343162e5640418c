"""What a graphics card is measured by (`make bench-gpu`): which parts, how, and whether its pictures are right."""
