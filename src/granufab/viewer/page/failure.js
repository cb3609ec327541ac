// What could not be answered, in words for the user.

export class Failure extends Error {}
