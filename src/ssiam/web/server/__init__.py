"""The live page on a port: who is let in, what they are sent, what they may ask."""
