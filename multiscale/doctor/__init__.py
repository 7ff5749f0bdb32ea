"""Is this machine fit for runs, and made ready for them?"""
